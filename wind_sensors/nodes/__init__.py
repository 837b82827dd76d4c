"""ROS 2 nodes: parameters in, messages out, no physics."""
