"""What a result file says, as one number: equal for runs that found the same bits."""
