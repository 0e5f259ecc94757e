"""The `tessera` command behind `setup`: starts and watches the processes of a run, and reports what came out."""
