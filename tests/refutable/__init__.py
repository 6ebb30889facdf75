"""Networks whose claim is false or whose assumptions fail: ``python -m tests.refutable`` counts those that get a
certificate."""
