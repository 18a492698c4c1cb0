"""Validation: the recorded commands of a real car driven from its recorded states, by our cars.

    found = validate(["drives/"], vehicle="f1tenth", tires="forzaeth_nuc5", mu=0.66)
    print(found)

`windows` finds windows and steady states in drives, `car_model` drives them as worlds of one batch, `agreement` says
how far a model is from the recordings, `validation` does all of this, and `validation_page` draws a result.
"""
