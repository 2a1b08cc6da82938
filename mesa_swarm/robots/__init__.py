"""Designs, sensors, drives, the swarm's columns and the Robot agent."""
