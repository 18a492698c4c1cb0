"""A live race for programs that speak rosbridge, the protocol of roslibpy and roslibjs."""
