"""The command ``torsight``: one light module per command; heavy imports stay inside the functions."""

import os

# Sums over several threads differ in their last digits (torsight.core.parallel.threads), but results must depend on the
# input alone. Set before the libraries that read these variables are loaded; child processes inherit them.
os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))
