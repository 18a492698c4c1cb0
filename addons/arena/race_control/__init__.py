"""Race control: contacts of cars and whose fault they were, overtakes, and what the rules make of them; standings.

A race of several cars, or with rules, reaches it through the table of parts. A race of one car loads none of it.
"""
