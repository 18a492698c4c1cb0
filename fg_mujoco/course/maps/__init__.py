"""ROS maps: a course from the image of a map, and a track exported as a map, a CSV or a mesh.

map_server   reads the YAML and the image: which pixels are free
region       finds the region that is raced on
closing      closes holes in its walls on request
walls        traces its walls
centreline   finds a line round it, or through it
map_track    makes a track or a scene of these
export       writes a track to a file
"""
