"""What a run of the workflow takes, from measured rates, before anything runs."""
