#include "datasets/readme_calibration.h"

#include <algorithm>
#include <cctype>
#include <map>
#include <regex>

namespace tessera {

std::optional<PinholeCamera> PinholeFromText(const std::string& text) {
  static const std::regex kChain(R"(((?:\b(?:fx|fy|cx|cy)\s*[=:]\s*)+)([0-9]+(?:\.[0-9]+)?))", std::regex::icase);
  static const std::regex kKey(R"(fx|fy|cx|cy)", std::regex::icase);
  std::map<std::string, double> values;
  for (std::sregex_iterator chain(text.begin(), text.end(), kChain), end; chain != end; ++chain) {
    const std::string keys = (*chain)[1];
    for (std::sregex_iterator key(keys.begin(), keys.end(), kKey); key != end; ++key) {
      std::string name = key->str();
      std::transform(name.begin(), name.end(), name.begin(),
                     [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
      values.emplace(name, std::stod((*chain)[2]));
    }
  }
  if (values.size() != 4) {
    return std::nullopt;
  }
  PinholeCamera camera;
  camera.fx_px = values["fx"];
  camera.fy_px = values["fy"];
  camera.cx_px = values["cx"];
  camera.cy_px = values["cy"];
  return camera.Check() ? std::optional(camera) : std::nullopt;
}

double DepthUnitFromText(const std::string& text) {
  static const std::regex kFactor(R"(\bfactor\s*[=:]?\s*([0-9]+(?:\.[0-9]+)?))", std::regex::icase);
  static const std::regex kMillimeters(R"(\bmillimet(?:re|er)s?\b)", std::regex::icase);
  std::smatch match;
  if (std::regex_search(text, match, kFactor)) {
    const double counts_per_m = std::stod(match[1]);
    return counts_per_m > 0.0 ? 1.0 / counts_per_m : 0.0;
  }
  return std::regex_search(text, kMillimeters) ? 1e-3 : 0.0;
}

}  // namespace tessera
