"""Speed of a recorded drive through outages: the state model, the filter, and the outage protocol."""
