"""Problems from the literature with known solutions."""
