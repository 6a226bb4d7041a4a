"""`python -m acl_gym` is `acl-gym`."""

from acl_gym.cli import main

if __name__ == "__main__":
    main()
