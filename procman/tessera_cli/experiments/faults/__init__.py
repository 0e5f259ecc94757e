"""tessera experiment faults: runs during which processes are killed, stopped and slowed down and packets are lost."""
