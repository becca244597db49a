"""Files as `recordings` reads them: checks of streams, the tidy folder, flight logs and receiver messages."""
