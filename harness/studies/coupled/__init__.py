"""Several FMUs, coupled: written as an SSP archive, run by an existing engine, compared with one monolithic model."""
