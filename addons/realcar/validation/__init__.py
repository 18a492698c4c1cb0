"""Validation: the recorded commands of a real car driven from its recorded states, by our cars and by other models.

    found = validate(["drives/"], vehicle="f1tenth", tires="forzaeth_nuc5", mu=0.66)
    print(found)
    scores = scoreboard(["drives/"], mu=0.66)

`windows` finds windows and steady states in drives, `car_model` drives them as worlds of one batch, `planar_models`
has the models of other simulators, `agreement` says how far a model is from the recordings, `validation` does all of
this, `scoreboard` compares models, and `validation_page` draws a result.
"""
