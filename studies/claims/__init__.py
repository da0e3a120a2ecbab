"""What the paper claims, what is measured here, and why: one table and its page."""

PAGES = {
    "claims": "what the paper claims beside what is measured",
}
