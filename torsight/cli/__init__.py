"""The command ``torsight``: one light module per command; heavy imports stay inside the functions."""

import os

# Sums over several threads differ in their last digits (torsight.core.parallel.threads), and results depend on the
# input alone. Set before anything loads the libraries that read it; processes that a command starts take it over.
os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))
