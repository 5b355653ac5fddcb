"""The live view: frames from a camera or a film that plays, a log that grows, both on disk and on the screen.

What measures (intake, tracker, recorder) never waits for what shows: pictures and curves go to a process of their own
through a queue that drops its oldest entries, and the model is computed in another one.
"""
