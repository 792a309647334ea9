"""Where methods stop being stable, and what stiffness costs."""
