"""The signal chain: from light to the counts that a board sends, every disturbance by itself.

docs/how-to/simulate-data-set.md has its parameters.
"""

from sims.readings.chain.signal_chain import SetDraw, SignalChain, chain_of, without_noise

__all__ = ["SetDraw", "SignalChain", "chain_of", "without_noise"]
