"""Camera geometry: pixels and a calibration in, rays, planes, circles and axes (m, rad) out."""
