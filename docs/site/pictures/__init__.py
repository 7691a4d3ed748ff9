"""The pictures of the site, made by the program that they are about."""
