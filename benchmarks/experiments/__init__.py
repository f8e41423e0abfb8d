"""The paper's four experiments through the page, the server and the robots' own protocols."""
