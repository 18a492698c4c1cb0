"""The live view: a race that is watched as it is driven, in a browser or in MuJoCo's viewer."""
