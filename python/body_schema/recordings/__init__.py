"""Recordings of a robot: bags of ROS and data sets of LeRobot, and the table for ``body-schema calibrate`` that is made of them.

Nothing is imported here, so that ``import body_schema`` needs no extra. The subcommand ``import`` uses them.
"""
