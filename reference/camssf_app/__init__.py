"""The page in the browser: a local server, one session for each tab, and a process for each session's work."""
