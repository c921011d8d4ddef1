"""What a long life does to files and runs; `make torture` tries it all, make test a little of it."""
