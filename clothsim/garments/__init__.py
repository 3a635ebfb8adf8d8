"""Garments: fitted to another body, and sewn on one."""
