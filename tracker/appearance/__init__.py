"""What a dot looks like and where it is in a picture.

In: a picture (uint8), a shape (px) or a rough place (px). Out: the picture of a dot and its derivatives (``disc``), its
shape by least squares (``dot_fit``), its place by Lucas–Kanade with a covariance in px² (``lucas_kanade``), and the
share of a frame for which the shutter is open (``motion_blur``).
"""
