"""Two folders of results side by side: what moved beyond noise, and under which conditions."""
