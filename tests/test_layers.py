"""The files of the package form no circle of imports."""

from __future__ import annotations

import graphlib

import grimp

# Imports made for type checking only count as well.
GRAPH = grimp.build_graph("acl_gym", cache_dir=None)


def test_no_circle_of_imports() -> None:
    imports = {
        module: GRAPH.find_modules_directly_imported_by(module)
        for module in GRAPH.modules
    }
    graphlib.TopologicalSorter(imports).prepare()


def test_type_only_imports_are_in_the_graph() -> None:
    assert GRAPH.direct_import_exists(importer="acl_gym", imported="acl_gym.agents.acl")
