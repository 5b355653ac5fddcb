"""The live view: frames from a camera or a film that plays, a log that grows, both on disk and on the screen.

What measures (intake, tracker, recorder) never waits for what shows: pictures and curves go to a process of their own
through a queue that drops its oldest entries, and the model is computed in another one.
:mod:`torsight.viewer.live.frames` takes pictures, :mod:`torsight.viewer.live.measure` measures in them and follows the
log, :mod:`torsight.viewer.live.record` writes it down, :mod:`torsight.viewer.live.screen` shows it;
``live_session`` runs all of it.
"""
