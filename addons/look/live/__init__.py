"""The live view: a race that is watched as it is driven, in a browser or in MuJoCo's viewer.

`live_session` has LiveSession, a race whose settings can be changed between ticks. `browser` shows it on a web page
(extra `live`), whose 3D scene is in `browser_scene` and `browser_shapes`. `desktop` shows it in MuJoCo's own viewer.
`hand_driver` turns key presses into commands.
"""
