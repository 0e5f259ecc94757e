"""Groups and ports of a stack's buses, on one machine and on a LAN."""

from tessera_cli.settings import network_assignments


def urls(on_lan: bool) -> dict[str, str]:
    pairs = [text.partition("=") for text in network_assignments(9000, on_lan)]
    return {key: value for key, _, value in pairs if key.endswith("_url")}


def test_nothing_leaves_one_machine() -> None:
    found = urls(on_lan=False)
    assert set(found) == {"bus.main_url", "bus.camera_url", "bus.color_url", "bus.work_url", "bus.map_url"}
    assert all(url.endswith("?ttl=0") for url in found.values())
    assert len(set(found.values())) == 5


def test_what_is_large_has_groups_of_its_own_on_a_lan() -> None:
    """A switch that snoops IGMP tells groups apart, not ports."""
    found = urls(on_lan=True)
    assert set(found) == {
        "bus.main_url",
        "bus.camera_url",
        "bus.color_url",
        "bus.work_url",
        "bus.map_url",
        "bus.tile_url",
    }
    assert all(url.endswith("?ttl=1") for url in found.values())
    groups = [url.removeprefix("udpm://").partition(":")[0] for url in found.values()]
    assert len(set(groups)) == 6 and "{id}" in found["bus.tile_url"]
