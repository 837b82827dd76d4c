"""From files of numbers to the page that people read."""
