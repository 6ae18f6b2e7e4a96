"""The demo; and the page in the browser: a local server, a session a tab, a process for its work."""
