"""The live view: frames from a camera or a playing film, and a growing log, recorded on disk and shown on the screen.

The measurement (intake, tracker, recorder) never waits for the display: pictures and curves go to a separate process
through a queue that drops its oldest entries, and the model is computed in another process.
:mod:`torsight.viewer.live.frames` takes pictures, :mod:`torsight.viewer.live.measure` measures in them and follows the
log, :mod:`torsight.viewer.live.record` writes the record, :mod:`torsight.viewer.live.screen` shows it; ``live_session``
runs all parts.
"""
