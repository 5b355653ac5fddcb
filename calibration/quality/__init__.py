"""Assessment of a calibration.

In: lenses, pairs and views of a calibration. Out: the verdict with its reasons, a picture of the coverage, the table
``[calibration]`` of ``CAMERA.toml``, and the lines for the terminal.
"""
