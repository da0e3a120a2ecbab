"""Where a result comes from: command, parameters, code, machine."""
