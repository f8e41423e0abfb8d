"""What a live session has to do before anybody relies on it: each is a command that keeps what it prints.

They share a scene (a session whose server is a process of its own), an operator, a witness of the robot and a page.
"""
