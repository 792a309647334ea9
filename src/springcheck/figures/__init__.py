"""Charts as data, and as pictures; the results of studies describe their own (`banks`)."""
