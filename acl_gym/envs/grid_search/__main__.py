"""`python -m acl_gym.envs.grid_search`: the program of `maps`."""

from acl_gym.envs.grid_search.maps import main

if __name__ == "__main__":
    main()
