"""Elastic gear stages as FMUs."""
