"""Pages of reference, each made from its source: the `.proto` files, the server's OpenAPI document, and docstrings."""
