"""What kind of motion it is: orbit period, stability, class."""
