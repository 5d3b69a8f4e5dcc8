"""Faces of an episode for foreign clients: a server speaks their protocol and plays agents of an ordinary episode.

- `airsim`  AirSim's MessagePack-RPC
"""
