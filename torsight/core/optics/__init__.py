"""Camera geometry: from pixels and a calibration to rays, planes, circles and axes (mm, rad)."""
