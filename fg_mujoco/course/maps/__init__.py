"""ROS maps: a course from the image of a map, and a track exported as a map, a CSV or a mesh.

map_server   reads the YAML and the image: which pixels are free
region       finds the region that is raced on
walls        traces its walls, and closes holes in them on request
centreline   finds a line round it, or through it
map_track    makes a track or a scene of these
export       writes a track to a file
"""
