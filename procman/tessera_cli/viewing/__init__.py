"""`tessera view`: what a run or a running stack looks like, drawn by rerun."""
