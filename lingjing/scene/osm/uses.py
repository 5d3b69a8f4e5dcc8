"""The use of a building: from its own tags, else from the land use around it."""

from __future__ import annotations

from collections.abc import Mapping

from lingjing.scene.osm.heights import STANDING, tagged_height_m, tagged_levels

USES = ("residential", "house", "commercial", "office", "industrial", "warehouse", "school", "public")
"""Uses of buildings."""

_WORDS = {
    "house": (
        "house detached semidetached_house semi duplex terrace bungalow cabin farm farmhouse hut villa chalet "
        "static_caravan allotment_house presbytery parsonage houseboat"
    ),
    "residential": "residential apartments dormitory block tower_block",
    "commercial": "commercial retail shop supermarket kiosk mall store hotel restaurant pavilion market parking",
    "office": "office skyscraper tower bank government",
    "industrial": "industrial factory manufacture works power substation transformer_tower service boiler_house",
    "warehouse": (
        "warehouse hangar storage_tank silo barn farm_auxiliary stable cowshed sty greenhouse boathouse shed garage "
        "garages carport carports container outbuilding depot"
    ),
    "school": "school university college kindergarten",
    "public": (
        "public civic hospital museum church cathedral chapel mosque temple shrine synagogue religious train_station "
        "station transportation stadium sports_hall sports_centre library theatre townhall fire_station grandstand "
        "monastery"
    ),
}
_USE_OF = {word: use for use, words in _WORDS.items() for word in words.split()}
_AMENITIES = {
    "school": ("school", "university", "college", "kindergarten"),
    "public": ("hospital", "library", "theatre", "townhall", "place_of_worship", "police", "arts_centre", "museum",
               "conference_centre", "fire_station", "courthouse", "community_centre"),
    "commercial": ("restaurant", "cafe", "fast_food", "bar", "marketplace", "cinema", "fuel", "pub"),
    "office": ("bank",),
}  # fmt: skip
_STAYS = {"commercial": ("hotel", "hostel", "motel"), "residential": ("apartment",),
          "house": ("guest_house", "chalet", "camp_site", "caravan_site", "alpine_hut", "wilderness_hut")}  # fmt: skip
_WORKS = ("works", "wastewater_plant", "water_works", "pumping_station")
_SPORTS = ("sports_centre", "sports_hall", "stadium", "swimming_pool", "ice_rink", "fitness_centre")
LOW = {"garage", "garages", "carport", "carports", "shed", "kiosk", "hut", "service", "roof", "tent", "toilets",
       "pavilion", "greenhouse", "container", "outbuilding"}  # fmt: skip
"""Values of `building` with one low storey."""

_LANDMARKS = {"church", "cathedral", "chapel", "mosque", "temple", "shrine", "synagogue", "religious", "tower",
              "skyscraper", "water_tower", "silo", "storage_tank", "chimney", "transformer_tower", "stadium",
              "grandstand", "monument", "lighthouse", "windmill", "castle", "ruins"}  # fmt: skip
"""Values of `building` that stand out of their surroundings."""

TOWERS = ("tower", "tower_block", "skyscraper")
"""Values of `building` that are tall in any place."""

_TALL_M = 60.0
"""Height from which a building without stated use is an office, metres (chosen)."""


def word_of(tags: Mapping[str, str]) -> str:
    """The value of `building`, or of `building:part` without it."""
    return tags.get("building", tags.get("building:part", ""))


def own_use(tags: Mapping[str, str]) -> str:
    """The use that a building's own tags state; empty if they state none."""
    word = word_of(tags)
    if word in _USE_OF:
        return _USE_OF[word]
    amenity = tags.get("amenity", "")
    for use, values in _AMENITIES.items():
        if amenity in values:
            return use
    if "office" in tags or "skyscraper" in tags:
        return "office"
    if "shop" in tags:
        return "commercial"
    for use, values in _STAYS.items():
        if tags.get("tourism") in values:
            return use
    if tags.get("man_made") in _WORKS:
        return "industrial"
    return "public" if "tourism" in tags or "historic" in tags or tags.get("leisure") in _SPORTS else ""


def use_of(tags: Mapping[str, str], around: str) -> str:
    """The use of a building: its own, else that of the land use `around` it; a tall one is an office."""
    own = own_use(tags)
    if own:
        return own
    height = tagged_height_m(tags) or 3.5 * (tagged_levels(tags) or 0.0)
    if height >= _TALL_M and around != "residential":
        return "office"
    return around or "residential"


def is_landmark(tags: Mapping[str, str]) -> bool:
    """True for a kind that stands out of its surroundings (a church, a silo), so that its height does not describe
    them.
    """
    return word_of(tags) in _LANDMARKS or tags.get("man_made") in STANDING or tags.get("amenity") == "place_of_worship"


def is_tower(tags: Mapping[str, str]) -> bool:
    """True for a building that its tag calls a tower."""
    return word_of(tags) in TOWERS


def rises(tags: Mapping[str, str], use: str) -> bool:
    """True for a use that grows with its neighbours: flats, offices, hotels, and buildings without stated use."""
    own = own_use(tags)
    if own != "commercial":
        return use in ("residential", "office") or (not own and use == "commercial")
    return word_of(tags) in ("commercial", "hotel") or tags.get("tourism") == "hotel"
