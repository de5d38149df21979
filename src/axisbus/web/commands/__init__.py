"""What a page asks for: read, judged by who asks and who has the controls, and carried out."""
