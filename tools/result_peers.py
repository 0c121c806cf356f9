"""What other methods reach on the same frames, gate 0.5 m, measured apart from this project."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Peer:
    """One method on one set; percent, metres, milliseconds a frame. None where it is not known."""

    method: str
    moda: float
    precision: float
    recall: float
    location_error: float
    idf1: float
    mota: float
    switches: int
    milliseconds: float | None


PEERS: dict[str, tuple[Peer, ...]] = {
    "uu4": (
        Peer("POM + flow", 98.5, 99.6, 98.8, 0.118, 99.1, 98.8, 1, 112),
        Peer("plain KS09 + flow", 80.6, 85.1, 97.7, 0.038, 83.0, 84.5, 2, 25),
        Peer("plain KS09 + flow, cells seen by 4 of 4 views", 95.7, 98.1, 97.7, 0.041, 77.0, 97.3, 3, 14),
        Peer("plain 4-D cut, cells seen by 4 of 4 views", 97.5, 98.3, 99.2, 0.031, 52.4, 92.8, 24, 32),
    ),
    "cmc1": (
        Peer("MV-GLMB-OC, the authors' tracks", 100, 100, 100, 0.083, 100, 100, 0, None),
        Peer("POM + flow", 98.6, 98.9, 99.7, 0.138, 99.3, 98.6, 0, 50),
        Peer("plain KS09 + flow", 99.4, 99.9, 99.5, 0.110, 99.7, 99.4, 0, 12),
        Peer("plain 4-D cut", 93.6, 96.7, 97.0, 0.123, 30.6, 89.8, 25, 43),
    ),
    "cmc2": (
        Peer("MV-GLMB-OC, the authors' tracks", 95.9, 98.3, 97.6, 0.138, 96.8, 94.2, 25, None),
        Peer("POM + flow", 69.5, 94.0, 74.2, 0.220, 30.1, 61.4, 136, 59),
        Peer("plain KS09 + flow", 29.7, 84.3, 36.5, 0.237, 14.0, 23.5, 113, 11),
        Peer("plain 4-D cut", 23.4, 87.6, 27.2, 0.232, 7.2, 15.1, 172, 67),
    ),
    "wildtrack": (Peer("POM + flow", 50.6, 75.5, 74.8, 0.197, 49.1, 40.7, 82, 612),),
    "wildtrack_annotated": (
        Peer("POM + Hungarian", 70.1, 90.3, 78.5, 0.174, 67.2, 60.7, 87, 609),
        Peer("plain KS09 + Hungarian", -16.1, 43.2, 51.0, 0.168, 32.3, -25.0, 88, 13),
    ),
}
"""By set."""
