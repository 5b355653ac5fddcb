"""The appearance of a dot, and its position in a picture.

In: a picture (uint8), a shape (px) or an approximate position (px). Out: the rendered picture of a dot and its
derivatives (``disc``), its shape by least squares (``dot_fit``), its position by Lucas–Kanade with a covariance in px²
(``lucas_kanade``), and the exposure as a share of the frame interval (``motion_blur``).
"""
