"""What the pipeline node is made of: where its frames come from, and what is computed of them."""
