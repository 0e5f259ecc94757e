# The tests and checks of the sources: sourced by `tessera` after setup.sh.

failed=()
# check NAME COMMAND...: runs it and remembers NAME if it fails.
check() {
  local name="$1"
  shift
  say "$name"
  "$@" || failed+=("$name")
}

# Ends with status 1 if a check failed.
tell_failures() {
  local list
  [ ${#failed[@]} -gt 0 ] || return 0
  printf -v list ', %s' "${failed[@]}"
  fail "failed: ${list#, }; the output above says why."
}

# --- tests ----------------------------------------------------------------------------------------
run_tests() {
  setup_machine all
  check "C++ tests" ctest --test-dir "$root/build" --output-on-failure -j "$(nproc)"
  check "Python tests" run_pytest
  tell_failures
}

# Three at a time: they wait for processes most of the time. helpers/stack.py gives each its ports.
run_pytest() (
  cd "$root"
  PYTHONPATH="$root/procman" .venv/bin/python -P -m pytest -p no:cacheprovider -n 3 --dist loadfile -rs tests
)

NOT_SANITIZED='^(simulation|stages)$'

# Programs of the unit tests.
sanitized_tests() {
  sed -nE 's/^tessera_test\(([a-z_]+).*/\1/p' "$root"/tests/*/CMakeLists.txt | grep -vE "$NOT_SANITIZED" | sed 's/$/_test/'
}

# run_sanitized LIST: the C++ tests in a build of their own, under these sanitizers of the compiler. Without the recorded
# sequences: those runs are long, and the same code is tested on made ones.
run_sanitized() {
  local folder="build-sanitize-${1//,/-}"
  prepare ask
  configure "$folder" -DCMAKE_BUILD_TYPE=Debug -DCMAKE_CXX_FLAGS_DEBUG="-Og -g1" -DTESSERA_SANITIZE="$1" \
    -DTESSERA_DATA="$root/$folder/no-data"
  # shellcheck disable=SC2046 # one word for each
  build_in "$folder" $(sanitized_tests) tessera_fuzz_targets
  finish_setup
  export ASAN_OPTIONS=detect_stack_use_after_return=1 UBSAN_OPTIONS=print_stacktrace=1 TSAN_OPTIONS=second_deadlock_stack=1
  # The unit tests: rendered worlds and whole pipelines take many minutes there (ctest --test-dir FOLDER runs them too).
  check "C++ tests, sanitized: $1" ctest --test-dir "$root/$folder" --output-on-failure -j "$(nproc)" -E "$NOT_SANITIZED"
  tell_failures
}

# --- fuzzing --------------------------------------------------------------------------------------
fuzz_families() { sed -nE 's/^tessera_fuzz\(([a-z_]+).*/\1/p' "$root/tests/fuzz/CMakeLists.txt"; }

# run_fuzz SECONDS: the fuzz targets, in a build of their own by Clang under sanitizers, one after the other, each for its
# share of the time. What libFuzzer finds worth keeping stays in build-fuzz/corpus: the next time continues from there.
# (libfuzzer_main.cc says how it gets into tests/fuzz/corpus.)
run_fuzz() {
  local family families=()
  mapfile -t families < <(fuzz_families)
  local share=$(($1 / ${#families[@]}))
  prepare ask
  install_missing clang-19 libclang-rt-19-dev llvm-19
  configure build-fuzz -DCMAKE_C_COMPILER=clang-19 -DCMAKE_CXX_COMPILER=clang++-19 -DTESSERA_FUZZ=ON \
    -DCMAKE_BUILD_TYPE=Debug -DCMAKE_CXX_FLAGS_DEBUG="-O1 -g1" -DTESSERA_SANITIZE=address,undefined,float-cast-overflow
  build_in build-fuzz tessera_fuzz_targets
  finish_setup
  for family in "${families[@]}"; do check "fuzzing: $family" run_fuzz_target "$family" $((share > 0 ? share : 1)); done
  tell_failures
  say "Nothing was found."
}

# run_fuzz_target FAMILY SECONDS: the last lines of its output, and all of it if it failed.
run_fuzz_target() {
  local folder="$root/build-fuzz/corpus/$1" target="$root/build-fuzz/tests/fuzz/$1_fuzz" log="$root/build-fuzz/$1.log"
  "$target" --unpack "$root/tests/fuzz/corpus/$1" "$folder"
  if UBSAN_OPTIONS=print_stacktrace=1 "$target" -max_total_time="$2" -max_len=8192 -rss_limit_mb=2048 -timeout=20 \
    -print_final_stats=1 -artifact_prefix="$root/build-fuzz/$1-" "$folder" >"$log" 2>&1; then
    sed -n 's/^stat::number_of_executed_units: */tessera: inputs: /p' "$log" >&2
  else
    tail -n 60 "$log" >&2
    return 1
  fi
}

# --- lint -----------------------------------------------------------------------------------------
cpp_sources() { find "$root/modules" "$root/procman" "$root/tests" -name '*.cc' -o -name '*.h'; }

run_lint() {
  prepare ask
  make_python_env .venv-lint requirements-lint.txt "with the tools of the lint"
  # As users build it, but without precompiled headers, which are GCC's own; of it only the messages' code is built.
  configure build-lint -DCMAKE_BUILD_TYPE=Release -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON
  build_in build-lint tessera_lcmtypes_cpp
  finish_setup
  check "clang-format" run_clang_format
  check "clang-tidy" run_clang_tidy
  check "ruff" run_ruff
  check "mypy" run_mypy
  tell_failures
  say "The lint found nothing."
}

run_clang_format() { cpp_sources | xargs "$root/.venv-lint/bin/clang-format" --dry-run -Werror; }

# Output only where there is something to say; xargs ends with a status above 0 if one of the calls did. -w: clang's own
# warnings are not among the checks, and computing them takes time (its errors are told all the same).
run_clang_tidy() {
  sed -nE 's/^  "file": "(.*\/(modules|procman)\/.*\.cc)",?$/\1/p' "$root/build-lint/compile_commands.json" |
    xargs -P "$(nproc)" -n 1 "$root/.venv-lint/bin/clang-tidy" -p "$root/build-lint" --quiet --warnings-as-errors='*' \
      --extra-arg=-w 2>&1 | grep -v 'warnings generated\|^Suppressed\|^Use -header-filter'
  [ "${PIPESTATUS[1]}" -eq 0 ]
}

run_ruff() (
  cd "$root"
  .venv-lint/bin/ruff check --no-cache . && .venv-lint/bin/ruff format --no-cache --check .
)

run_mypy() (
  cd "$root"
  .venv-lint/bin/mypy --python-executable .venv/bin/python --cache-dir build-lint/mypy
)
