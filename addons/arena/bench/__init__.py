"""The card of a planner: a bundled suite of courses and conditions, driven with and without the stages that help.

`suite` reads what is driven, `card` drives it and scores it, and `card_page` shows it beside the bundled planners.
"""
