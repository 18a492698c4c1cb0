"""What is drawn at random: circuits from a seed (`generator`), and things that move on a track (`moving`)."""
