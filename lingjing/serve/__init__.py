"""Faces of an episode for foreign clients: a server speaks their protocol and plays agents of an ordinary episode.

- `airsim`     AirSim's MessagePack-RPC
- `lj_engine`  LJ-ENGINE, the protocol of the paper's engines: foreign engines play bodies of an ordinary episode
"""
