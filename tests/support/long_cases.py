"""Golden cases that the default run leaves to the full one: a second and more each, of code that others run, too."""

LONG = frozenset(
    f"{stage}/{name}"
    for stage, names in {
        "calibrate": "auto-camera auto-other-maker error-rival-of-four families five-shots",
        "light": "faded one-of-two three told-of-two torch",
        "picture": "auto calibration cfa-bggr corner dark odd torch turned xyz-d50",
    }.items()
    for name in names.split()
)
