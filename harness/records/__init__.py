"""What people measured, read from the files that they have: tables of any kind, their headings, units and clocks."""
