"""Plants to begin with, for `acl-gym design --example NAME`.

Each file is complete: copy it (`acl-gym design --show NAME > my_plant.py`), put in your
equations and your numbers, and run `acl-gym design my_plant.py`.
"""
